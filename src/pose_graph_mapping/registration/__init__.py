"""How one cloud lies to another: whatever has `match(reference, reading, guess)`."""
