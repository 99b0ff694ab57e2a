"""The studies of the papers, one a file, and what runs them."""
