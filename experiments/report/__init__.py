"""What results are shown with: tables, plots, HTML pages, replays."""
