"""A language as a page that one looks at: self-contained HTML that opens offline."""
