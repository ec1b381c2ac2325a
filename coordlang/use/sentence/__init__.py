"""A language in one task: saying plans, understanding sentences, planning under them."""
