"""Reproductions of papers: what each claims, measured by running it."""

from interfaces.lab.claims import Claim, Findings, Paper, PaperPart, Reproduction, Study, Table
from interfaces.lab.papers import PAPERS, papers
from interfaces.lab.runner import reproduce, reproductions

__all__ = [
    "PAPERS",
    "Claim",
    "Findings",
    "Paper",
    "PaperPart",
    "Reproduction",
    "Study",
    "Table",
    "papers",
    "reproduce",
    "reproductions",
]
