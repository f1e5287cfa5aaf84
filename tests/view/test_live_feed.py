"""What live pages are pushed, and how often."""

import json
import threading
import time

from besman.view.live_feed import describe_place, join_news
from besman.web.push import Broadcast


def test_the_present_is_pushed_when_it_has_changed_and_no_faster_than_it_is_drawn():
    news, state, frames, n_lines = Broadcast(), {"row": 0}, [], 0
    feed = join_news(news, lambda: state["row"], lambda: dict(state))
    begun = time.monotonic()

    def change():
        # A thousand times a second, and lines as often; until some of it was seen.
        while state["row"] < 300 or (len(frames) < 2 and time.monotonic() < begun + 60):
            state["row"] += 1
            news.send("{}")
            time.sleep(0.001)
        news.end()

    thread = threading.Thread(target=change)
    thread.start()
    for line in feed:
        one = json.loads(line or "null")
        n_lines += one == {}
        if one:
            frames.append(one["row"])
    thread.join()
    seconds = time.monotonic() - begun
    assert frames == sorted(set(frames))
    assert n_lines == state["row"]
    assert 2 <= len(frames) <= 3 + 31 * seconds


def test_what_is_not_seen_is_nowhere():
    assert describe_place([0.12345, 1.0, float("inf")]) is None
    assert describe_place([0.12345, 1.0, 2.0]) == [0.123, 1.0, 2.0]
