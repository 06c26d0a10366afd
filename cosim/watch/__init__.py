"""A diagram on a page that follows it: every save runs it again, in a process apart, and shows what that changed."""
