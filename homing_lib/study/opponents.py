"""What learning is worth: against robots that do not learn, and from anywhere."""
