from __future__ import annotations

from tr_grasp.cli.table import text_table


def test_a_table_by_hand() -> None:
    assert text_table(("suite", "n"), [("pile", "200"), ("single", "7")]) == (
        "suite     n\n"
        "------  ---\n"
        "pile    200\n"
        "single    7"
    )  # fmt: skip


def test_more_columns_can_be_texts() -> None:
    assert text_table(("a", "why", "n"), [("x", "lost", "3")], left_n=2).splitlines()[-1] == "x  lost  3"


def test_a_table_without_rows_is_its_head() -> None:
    assert text_table(("a", "bc"), []) == "a  bc\n-  --"
