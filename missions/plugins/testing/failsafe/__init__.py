"""What a base does, and why, while something goes wrong: the product's own classes, stepped through."""
