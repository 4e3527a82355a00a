"""Count collisions, and ask of each whether it was avoidable."""

from steerclear.experiments.play.match import play_match
from steerclear.experiments.play.spec import MatchSpec

spec = MatchSpec("aamas2024", own="easy", opponent="rammer", seed=1, rules={"max_time_s": 60.0}, judge="all")
row = play_match(spec).row
print("entries into 2.5 m of an opponent:", row["violations_opponent_2.5m"])
print("judged in hindsight:", *(violation["verdict"] for violation in row["violations"] or []))
