"""Deployment: policy process, referee, preflight, dashboard, and what ties them to the loop of `shield.bridge`."""
