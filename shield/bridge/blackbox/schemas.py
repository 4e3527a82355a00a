"""JSON Schemas of the log's own messages.

Only forms that log viewers understand: objects with named properties, arrays of plain values or of such objects.
"""

from __future__ import annotations

from typing import Any

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
WHOLE: Schema = {"type": "integer"}
TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}


def record(description: str, **properties: Schema) -> Schema:
    """Schema of an object."""
    return {"type": "object", "description": description, "properties": properties}


def many(items: Schema, description: str = "") -> Schema:
    """Schema of an array."""
    return {"type": "array", "items": items, "description": description}


def choice(**values: int) -> Schema:
    """Schema of an enumeration: whole numbers with names."""
    return {"oneOf": [{"title": name, "const": value} for name, value in values.items()]}


def named(title: str, schema: Schema) -> Schema:
    """The schema with its name."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema}


_CIRCLE = record("circle, m", x_m=NUMBER, y_m=NUMBER, radius_m=NUMBER)

_BOAT = record(
    "one boat as the shield saw it, what was wanted of it and what was decided",
    name=TEXT,
    platform=TEXT,
    team=WHOLE,
    controlled=FLAG,
    state=many(
        NUMBER,
        "x m, y m, heading deg, speed m/s, thrust %, rudder %, speed error m/s and integral, heading error deg and "
        "integral, turn rate deg/s",
    ),
    age_s=NUMBER,
    position_error_m=NUMBER,
    wanted=many(NUMBER, "speed m/s; heading rad from the y axis, or deg from the boat's own where wanted_relative"),
    sent=many(NUMBER, "likewise, after the shield"),
    intervened=FLAG,
    reason=WHOLE,
    why=TEXT,
    certificate_m=NUMBER,
    slack_m=NUMBER,
    bound=WHOLE,
    cut_short=FLAG,
)

_READING = record(
    "what a boat's own telemetry said",
    boat=TEXT,
    read_s=NUMBER,
    position_m=many(NUMBER, "x, y"),
    position_age_s=NUMBER,
    heading_rad=NUMBER,
    heading_age_s=NUMBER,
    speed_mps=NUMBER,
    course_rad=NUMBER,
    velocity_age_s=NUMBER,
    turn_rate_rads=NUMBER,
    turn_rate_age_s=NUMBER,
    mode=TEXT,
    ready=FLAG,
    why_not=TEXT,
    released=FLAG,
    heartbeat_age_s=NUMBER,
    texts=many(TEXT),
    faults=many(record("refused since the last reading", kind=TEXT, count=WHOLE)),
)

TICK = named(
    "steerclear.Tick",
    record(
        "One turn of the loop. A number that is not finite is left out, 0 in a list, and listed in odd.",
        number=WHOLE,
        due_s=NUMBER,
        began_s=NUMBER,
        sent_s=NUMBER,
        policy_age_s=NUMBER,
        shield_reset=FLAG,
        has_fleet=FLAG,
        has_wanted=FLAG,
        has_decisions=FLAG,
        wanted_relative=FLAG,
        sent_relative=FLAG,
        solve_time_s=NUMBER,
        boats=many(_BOAT),
        surroundings=many(
            record(
                "static constraints given with this decision; empty: as in the header",
                field=many(NUMBER, "xmin, ymin, xmax, ymax, m"),
                circles=many(_CIRCLE),
                keep_out=many(_CIRCLE),
                stops=many(_CIRCLE),
                polygons=many(record("corners", x_m=many(NUMBER), y_m=many(NUMBER))),
            )
        ),
        readings=many(_READING),
        contacts=many(
            record(
                "a boat seen from outside",
                boat=TEXT,
                position_m=many(NUMBER, "x, y"),
                heading_rad=NUMBER,
                speed_mps=NUMBER,
                fixed_s=NUMBER,
                error_m=NUMBER,
                source=TEXT,
            )
        ),
        sent=many(
            record(
                "what left for a boat",
                boat=TEXT,
                sent_s=NUMBER,
                heading_rad=NUMBER,
                speed_mps=NUMBER,
                route=TEXT,
                delivered=FLAG,
                limit_mps=NUMBER,
            )
        ),
        actions=many(record("declared and in effect", subject=TEXT, condition=TEXT, response=TEXT, text=TEXT)),
        game=TEXT,
        odd=many(record("a number that is not finite: its place, and nan, inf, -inf or nan:BITS", at=TEXT, value=TEXT)),
    ),
)

HEADER = named(
    "steerclear.Header",
    record(
        "What the shield was built with; the first message. Texts that begin with a bracket are JSON.",
        version=WHOLE,
        fleet_yaml=TEXT,
        preset=TEXT,
        policy=TEXT,
        clock_s=NUMBER,
        unix_ns=TEXT,
        sources=TEXT,
        machine=TEXT,
        shield=TEXT,
        surroundings=TEXT,
        platforms=TEXT,
        boats=TEXT,
        frame=TEXT,
        field_size_m=TEXT,
        notes=TEXT,
        versions=TEXT,
        tables=TEXT,
        chain=TEXT,
    ),
)

LINK = named(
    "steerclear.Link",
    record(
        "A link of the log's chain: the digest of the records since the last link, and of that.",
        count=WHOLE,
        digest=TEXT,
        end=TEXT,
        code=TEXT,
    ),
)

MENDED = named("steerclear.Mended", record("The file was written from one that was cut off.", damage=many(TEXT)))
