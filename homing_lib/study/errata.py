"""What is wrong in the printed paper, or left open: where, what, how it is read here, and what proves it.

`errata.toml` holds the entries and says what each part is. Where a reading was run, its effect is among the findings.
"""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from homing_lib.errors import UserError, shown
from homing_lib.study import findings


@dataclass(frozen=True)
class Erratum:
    """An entry of `errata.toml`. str() is a paragraph in Markdown.

    effects: by the name of a reading, the comparison that shows what it does: "printed.E3 form 1.of ours.total".
    """

    name: str
    where: str
    printed: str
    wrong: str
    reading: str
    proofs: Sequence[str]
    effects: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return (
            f"**{self.name}**, {self.where}: {self.printed}. {self.wrong}. *Here*: {self.reading}. "
            f"{effect(self)}*Proof*: {'; '.join(self.proofs)}."
        )


def read(file: Path) -> tuple[Erratum, ...]:
    """The errata of such a file. Raises UserError, in one line, if it is not there or not right."""
    try:
        entries = tomllib.loads(file.read_text(encoding="utf-8"))
        return tuple(Erratum(name, **entry) for name, entry in entries.items())
    except (OSError, ValueError, TypeError) as error:
        raise UserError(f"{file}: {' '.join(str(error).split())}; mend it, or restore it with git") from None


ERRATA = read(Path(__file__).with_suffix(".toml"))


def chosen(names: Sequence[str] = ()) -> tuple[Erratum, ...]:
    """Errata by their names, by default all. Raises UserError for a name that there is not."""
    every = {one.name: one for one in ERRATA}
    for name in names:
        if name not in every:
            raise UserError(f"{shown(name)}: no such erratum; there are E1 to E{len(every)}")
    return tuple(every[name] for name in names or every)


def _effects(erratum: Erratum) -> dict[str, findings.Comparison]:
    """By reading that was run, its total steps as a multiple of ours."""
    named = {reading: name.partition(".") for reading, name in erratum.effects.items()}
    return {reading: findings.finding(question)[key] for reading, (question, _, key) in named.items()}


def effect(erratum: Erratum) -> str:
    """What the readings that were run do to the total steps, in words; nothing if none was."""
    each = [f"{reading}, {comparison:.2f}: {comparison.verdict}" for reading, comparison in _effects(erratum).items()]
    return f"Total steps, as a multiple of ours: {'; '.join(each)}. " if each else ""


def changes_steps(erratum: Erratum) -> bool:
    """Whether one of the readings that were run takes fewer or more total steps than ours."""
    return any(comparison.verdict in ("fewer", "more") for comparison in _effects(erratum).values())


def table(errata: Iterable[Erratum]) -> str:
    """Errata as a table in Markdown."""
    head = "| | where | as printed, and why it cannot stand | here, and what it changes | proof |"
    rows = [
        f"| {one.name} | {one.where} | {one.printed}. {one.wrong}. | {one.reading}. {effect(one)}".rstrip()
        + f" | {'; '.join(map(_sentence, one.proofs))} |"
        for one in errata
    ]
    return "\n".join([head, "|---" * 5 + "|", *rows])


def _sentence(proof: str) -> str:
    """A test's name is the sentence that it proves; other proofs as they stand."""
    path, _, test = proof.partition("::test_")
    return f"{test.replace('_', ' ')} ({path})" if test else proof
