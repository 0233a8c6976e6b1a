"""Trees of missions as text: for terminals, documents, and whoever draws them."""
