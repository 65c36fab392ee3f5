"""Pages and pictures for people, and what they are drawn from."""
