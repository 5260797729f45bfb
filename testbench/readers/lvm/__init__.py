"""LabVIEW measurement files (``.lvm``). ``scan`` finds the headers, ``header`` reads them, ``rows`` the data."""
