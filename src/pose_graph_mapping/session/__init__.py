"""What a mapping session leaves on disk, and how it goes on from there."""
