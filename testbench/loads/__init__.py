"""What sensors measured of the loads of a mechanism: forces, moments, torques."""
