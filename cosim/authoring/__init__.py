"""What blocks are written with, and what an author's functions say."""
