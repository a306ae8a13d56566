"""What a class uses: the lab, its checks, exercises, and what is handed out."""
