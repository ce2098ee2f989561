"""The replay page: one self-contained HTML file that says why a mission went as it did."""

from monitor.page.rendering import page_data, render, write_page

__all__ = ["page_data", "render", "write_page"]
