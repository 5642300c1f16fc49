"""The line of a part of YAML data, found by reading the text again when an error is reported.

Recording the lines of all parts would make every text slower to read.
"""

from typing import Any

import yaml
from yaml.events import AliasEvent, MappingStartEvent, ScalarEvent, SequenceStartEvent

from reference_rt.scene.yaml_text import Events, MalformedError, Parser


def line_of(text: str, keys: tuple[str | int, ...]) -> int | None:
    """The line, from 1, of the part at the key path, or of the closest part around it; None if the
    text is not YAML."""
    try:
        walk = _Walk(text)
        line, event = 1, walk.following() if walk.begin() else None
        for key in keys:
            event = walk.target(event)
            if isinstance(event, MappingStartEvent):
                place = walk.enter_key(str(key))
            elif isinstance(event, SequenceStartEvent) and isinstance(key, int):
                place = walk.enter_item(key)
            else:
                break
            if place is None:
                break
            line, event = place
        return line
    except (MalformedError, yaml.YAMLError, UnicodeError):
        return None


class _Walk(Events):
    """Walks the parser's events to one part of the text."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.count = 0
        self.anchors: dict[str, int] = {}  # event number of each anchor

    def following(self) -> Any:
        event = super().following()
        anchor = getattr(event, "anchor", None)
        if anchor is not None and not isinstance(event, AliasEvent):
            self.anchors[anchor] = self.count
        self.count += 1
        return event

    def target(self, event: Any) -> Any:
        """The event that an alias refers to: the text is read again up to there."""
        if not isinstance(event, AliasEvent) or event.anchor not in self.anchors:
            return event
        wanted = self.anchors[event.anchor]
        self.parser, self.count, self.anchors = Parser(self.text), 0, {}
        while self.count < wanted:
            self.following()
        return self.following()

    def enter_key(self, wanted: str) -> tuple[int, Any] | None:
        """The line of a key in the current mapping, and the first event of its value."""
        while self.is_start(key := self.following()):
            if isinstance(key, ScalarEvent) and key.value == wanted:
                return key.start_mark.line + 1, self.following()
            self.skip(key)
            self.skip(self.following())
        return None

    def enter_item(self, wanted: int) -> tuple[int, Any] | None:
        """The line of an item in the current list, and its first event."""
        while self.is_start(item := self.following()):
            if wanted == 0:
                return item.start_mark.line + 1, item
            self.skip(item)
            wanted -= 1
        return None

    @staticmethod
    def is_start(event: Any) -> bool:
        return isinstance(event, yaml.NodeEvent)

    def skip(self, event: Any) -> None:
        """Skip to the end of the value that begins with `event`."""
        depth = 0
        while True:
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            if depth == 0:
                return
            event = self.following()
