"""Stages of one decision: nominal check, right of way, groups, backups, QP, line search, hard line."""
