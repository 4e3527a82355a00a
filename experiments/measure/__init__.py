"""What happened in games, as numbers: breaches, verdicts, scores, summaries and their intervals."""
