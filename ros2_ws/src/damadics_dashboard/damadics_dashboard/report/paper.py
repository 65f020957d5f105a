# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A report as PDF."""

import re
from importlib import resources
from pathlib import Path

from fpdf import FPDF
from fpdf.enums import TableCellFillMode, XPos, YPos
from fpdf.fonts import FontFace

from damadics_dashboard.report.content import Report
from damadics_dashboard.report.forms import Chart, charts_of, numeric_columns
from damadics_dashboard.report.signature import SignatureLines
from damadics_dashboard.words.texts import Texts

INK, MUTED, LINE = (21, 32, 43), (86, 100, 115), (213, 221, 229)
BLUE, RED, BAND = (10, 100, 189), (195, 38, 46), (206, 224, 244)
Color = tuple[int, int, int]
WIDTH = 180.0  # mm, of what is written
GAP = 8.0  # mm, between two charts side by side
HEIGHT, MARGIN = 28.0, 13.0  # mm, of a chart, of its numbers on the left
FONT = 'DejaVu'
LONGEST_WORD = 60  # characters that fit on a line of a table
ROOM = 28.0  # mm, of a heading and the first rows of its table
PADDING = 3.0  # mm, of a cell of a table
MOST_CHARTS = 4  # what is left of the first page
WHITE = (255, 255, 255)


def pdf(report: Report, t: Texts) -> bytes:
    """
    Return a report as PDF.

    :param report: the report.
    :param t: the words.
    :return: the file.
    """
    paper = _Paper(report.footer)
    paper.set_title(report.title)
    paper.set_lang(t.language)
    paper.add_page()
    paper.heading(report.title, 17.0)
    paper.line_of(report.subtitle, 9.0, MUTED)
    paper.ln(2.0)
    paper.table_of([name for name, _ in report.facts], [[value for _, value in report.facts]])
    for n, line in enumerate(report.summary):
        paper.line_of(line, 12.0 if n == 0 else 10.0, INK if n < 2 else MUTED)
    if report.signature:
        paper.signature(report.signature, t)
    charts = charts_of(report)[:MOST_CHARTS]
    for first in range(0, len(charts), 2):
        paper.charts(charts[first : first + 2], t)
    for title, heads, rows in report.tables:
        if rows:
            paper.room(ROOM)
            paper.heading(title, 12.0)
            paper.table_of(heads, rows)
    return bytes(paper.output())


class _Paper(FPDF):
    """A4 in the project's look."""

    def __init__(self, footer: str) -> None:
        super().__init__(format='A4')
        self._footer = footer
        self.set_margins(15.0, 14.0)
        self.set_auto_page_break(True, 16.0)
        folder = _fonts()
        self.add_font(FONT, '', folder / 'DejaVuSans.ttf')
        self.add_font(FONT, 'B', folder / 'DejaVuSans-Bold.ttf')
        self.set_font(FONT, size=9.0)

    def footer(self) -> None:
        """Close a page."""
        self.set_y(-12.0)
        self.set_font(FONT, size=7.0)
        self.set_text_color(*MUTED)
        self.cell(WIDTH - 20.0, 5.0, self._footer)
        self.cell(20.0, 5.0, str(self.page_no()), align='R')

    def heading(self, text: str, size: float) -> None:
        """Write a heading."""
        self.ln(1.5)
        self.line_of(text, size, INK, 'B')

    def line_of(self, text: str, size: float, color: Color, style: str = '') -> None:
        """Write a paragraph."""
        self.set_font(FONT, style, size)
        self.set_text_color(*color)
        self.multi_cell(
            WIDTH, 0.5 * size, _broken(text), new_x=XPos.LMARGIN, new_y=YPos.NEXT, align='L'
        )

    def table_of(self, heads: list[str], rows: list[list[str]]) -> None:
        """Write a table."""
        self.set_font(FONT, size=7.5)
        self.set_text_color(*INK)
        self.set_draw_color(*LINE)
        columns = [[str(row[n]) for row in [heads, *rows]] for n in range(len(heads))]
        with self.table(
            width=WIDTH,
            col_widths=self._widths(columns),
            line_height=4.0,
            text_align='LEFT',
            borders_layout='HORIZONTAL_LINES',
            headings_style=FontFace(emphasis='BOLD', color=MUTED),
            cell_fill_mode=TableCellFillMode.NONE,
        ) as table:
            numbers = numeric_columns(heads, rows) if len(rows) > 1 else [False] * len(heads)
            for line in [heads, *rows]:
                row = table.row()
                for text, number in zip(line, numbers, strict=True):
                    row.cell(_broken(str(text)), align='RIGHT' if number else 'LEFT')

    def _widths(self, columns: list[list[str]]) -> tuple[float, ...]:
        """Part the page among columns: no word is broken, the rest by how much there is to say."""
        self.set_font(FONT, 'B', 7.5)
        width = self.get_string_width
        least = [max(width(w) for x in texts for w in (*x.split(), ' ')) for texts in columns]
        least = [min(each, WIDTH / 3.0) + PADDING for each in least]
        wanted = [
            max(max(map(width, texts)) + PADDING - each, 0.1)
            for texts, each in zip(columns, least, strict=True)
        ]
        wanted = [min(each, WIDTH) for each in wanted]
        left = max(WIDTH - sum(least), 0.0) / sum(wanted)
        self.set_font(FONT, size=7.5)
        return tuple(each + left * more for each, more in zip(least, wanted, strict=True))

    def signature(self, lines: SignatureLines, t: Texts) -> None:
        """Draw force over position, fault-free and at the end."""
        self.heading(t('signature_title'), 9.0)
        left, top, width = self.get_x() + 16.0, self.get_y() + 1.0, WIDTH - 16.0
        self.set_draw_color(*LINE)
        self.rect(left, top, width, HEIGHT)
        self.set_line_width(0.35)
        for color, both in ((MUTED, lines.before), (BLUE, lines.now)):
            self.set_draw_color(*color)
            for (x1, y1), (x2, y2) in both:
                high, low = (top + HEIGHT * (1.0 - y) for y in (y1, y2))
                self.line(left + width * x1, high, left + width * x2, low)
        self.set_line_width(0.2)
        self.set_y(top + HEIGHT + 1.0)
        self.line_of(t('signature_report'), 7.0, MUTED)

    def room(self, height: float) -> None:
        """Begin a page where less than that is left of this one [mm]."""
        if self.get_y() + height > self.page_break_trigger:
            self.add_page()

    def charts(self, charts: list[Chart], t: Texts) -> None:
        """Draw trends side by side: band of least and greatest, mean, limits."""
        self.room(HEIGHT + 16.0)
        self.ln(2.5)
        top = self.get_y()
        for n, chart in enumerate(charts):
            self._chart(chart, self.l_margin + n * (WIDTH + GAP) / 2.0, top, t)
        self.set_xy(self.l_margin, top + HEIGHT + 10.0)

    def _chart(self, chart: Chart, left: float, top: float, t: Texts) -> None:
        self.set_font(FONT, 'B', 8.0)
        self.set_text_color(*INK)
        self.text(left + self.c_margin, top + 3.0, f'{chart.name} [{chart.unit}]')
        width = (WIDTH - GAP) / 2.0 - MARGIN
        left, top = left + MARGIN, top + 5.0

        def place(x: float, y: float) -> tuple[float, float]:
            return left + width * x, top + HEIGHT * (1.0 - y)

        def write(right: float, y: float, text: str) -> None:
            self.text(right - self.get_string_width(text), y, text)

        self.set_draw_color(*LINE)
        self.rect(left, top, width, HEIGHT)
        self.set_font(FONT, size=6.5)
        self.set_text_color(*MUTED)
        for share, value in chart.ticks:
            x, y = place(0.0, share)
            self.line(x, y, x + width, y)
            write(left - 1.5, y + 0.8, t.number(value))
        self.text(left, top + HEIGHT + 3.5, chart.first)
        write(left + width, top + HEIGHT + 3.5, chart.last)
        if len(chart.band) > 2:
            self.set_fill_color(*BAND)
            self.polygon([place(*p) for p in chart.band], style='F')
            self.set_fill_color(*WHITE)  # else the tables that follow are filled too
        self.set_draw_color(*BLUE)
        self.set_line_width(0.35)
        if len(chart.mean) > 1:
            self.polyline([place(*p) for p in chart.mean])
        self.set_draw_color(*RED)
        self.set_line_width(0.25)
        self.set_dash_pattern(dash=1.5, gap=1.0)
        for share in chart.limits:
            self.line(*place(0.0, share), *place(1.0, share))
        self.set_dash_pattern()
        self.set_line_width(0.2)


def _broken(text: str) -> str:
    """Part words that no line of the paper could hold."""
    return re.sub(rf'(\S{{{LONGEST_WORD}}})', r'\1 ', text)


def _fonts() -> Path:
    """Return the folder of DejaVu, which matplotlib's wheel carries."""
    return Path(str(resources.files('matplotlib'))) / 'mpl-data' / 'fonts' / 'ttf'
