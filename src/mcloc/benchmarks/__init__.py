"""What mcloc is measured by: its operations, and the same work in plain NumPy."""
