"""What people read: tables, plots, HTML pages and the pages of docs that are made of results."""
