"""From the shield to boats: links, the fixed-rate loop, what happens when something fails, and the black box."""
