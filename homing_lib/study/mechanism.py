"""What in lambda_t matters: its timing, its size, its sign, and in which rooms."""
