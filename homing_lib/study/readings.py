"""What the reward does, what the paper's letter gives, and what the earlier model gave."""
