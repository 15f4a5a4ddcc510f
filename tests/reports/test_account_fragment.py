"""The account in a notebook: every text is text, whatever it holds."""

from dataclasses import replace

import pytest
from pages import check_fragment
from rich_diagnoses import RICH

from gpsim.reports.account import account_of
from gpsim.reports.diagnosis_figures import Picture
from gpsim.reports.diagnosis_page import account_fragment

EVIL = "</style><script>alert(1)</script><img src=x onerror=alert(1)>\"'&"


@pytest.mark.parametrize("kind", RICH)
def test_every_kind_of_account(kind):
    account = account_of(RICH[kind]())
    piece = check_fragment(account_fragment(account))
    assert f"Verdict: {account.verdict}." in piece.text
    for text in (account.where, *(row.effect for row in account.rows), *account.left, *account.next):
        assert text in piece.text


def test_odd_names_are_text():
    account = account_of(RICH["named"]())
    plain = check_fragment(account_fragment(account))
    row = replace(account.rows[0], effect=EVIL, whole=EVIL + "!", gate=EVIL, sizes=((EVIL, EVIL),))
    odd = replace(account, where=EVIL, rows=(row,), slight=EVIL, rivals=(EVIL,), left=(EVIL,), next=(EVIL,))
    piece = check_fragment(account_fragment(odd, [Picture(EVIL, EVIL, b"png")]))
    assert piece.tags - plain.tags <= {"img", "br"}
    assert piece.text.count(EVIL) >= 6
