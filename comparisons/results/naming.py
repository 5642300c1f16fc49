"""What the two sides of a case are called in sentences for people.

Measurements speak of the candidate and the reference.  Where the sides have names of their own,
such as "ours" and "Mitsuba's", sentences have these, so that a page has one name for each side.
"""

import re

_OWNERS = {"ours": "our"}
"""Before a noun, where that is another word."""

_NAME = re.compile(r"ours|[\w .]+'s")
"""Names that sentences can have; others, such as "the baseline's, room", say more."""

_ROLE = re.compile(r"\bthe (candidate|reference)('s)?(?! rung)\b")


def named(text: str, sides: tuple[str, str]) -> str:
    """The text with the sides' names in place of "the candidate" and "the reference".

    sides: possessives, as of `Case`; a side without a name of its own keeps its role.
    """

    def name(found: re.Match[str]) -> str:
        side = sides[0] if found[1] == "candidate" else sides[1]
        if side.removeprefix("the ").startswith(found[1]) or not _NAME.fullmatch(side):
            return found[0]
        if found[2] is None:
            return f"{_OWNERS.get(side, side)} picture"
        following = text[found.end() : found.end() + 2]
        before_noun = len(following) == 2 and following[0] == " " and following[1].isalpha()
        return _OWNERS.get(side, side) if before_noun else side

    return _ROLE.sub(name, text)
