"""Pictures of packings and modes."""
