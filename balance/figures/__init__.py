"""Pictures of the mechanics."""
