"""The target of every filter, and the proposals q that draw from it and weigh by target / q."""
