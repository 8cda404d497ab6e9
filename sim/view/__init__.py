"""What motions look like: scenes, pictures, videos, pages, the window."""
