"""Building blocks of a self-contained HTML page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

STYLE = """
:root { color-scheme: light dark; --text: #1c2534; --muted: #5b6779; --ground: #f5f7fa; --card: #ffffff;
  --line: #e1e6ee; --accent: #2b5fc7; --good: #1f8a56; --bad: #c1473d; }
@media (prefers-color-scheme: dark) { :root { --text: #e4e9f1; --muted: #98a4b6; --ground: #10151e; --card: #19212d;
  --line: #2b3648; --accent: #8ab0fa; --good: #4cc38a; --bad: #ef7d72; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--text);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 40px 24px 72px; }
h1 { font-size: 1.9rem; line-height: 1.2; letter-spacing: -0.015em; margin: 0 0 6px; }
h2 { font-size: 1.15rem; margin: 44px 0 12px; }
p.lead { color: var(--muted); margin: 0 0 20px; max-width: 70ch; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 16px 18px; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(440px, 1fr)); gap: 16px; }
@media (max-width: 520px) { .grid { grid-template-columns: 1fr; } }
.grid + .card { margin-top: 16px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; color: var(--muted); font-size: 0.82rem; white-space: nowrap; }
th, td { padding: 8px 14px 8px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child td { border-bottom: 0; }
td.key { color: var(--muted); white-space: nowrap; width: 1%; padding-right: 28px; }
strong { font-weight: 650; }
figure { margin: 0; }
figure img { width: 100%; height: auto; display: block; border-radius: 6px; }
figcaption { font-size: 0.88rem; color: var(--muted); margin-top: 8px; }
figure.plot figcaption { margin: 0 0 8px; color: var(--text); font-weight: 600; font-size: 0.95rem; }
code { font: 0.86em/1.5 ui-monospace, SFMono-Regular, Menlo, Consolas, monospace; overflow-wrap: anywhere; }
.good { color: var(--good); } .bad { color: var(--bad); }
"""


def page(title: str, sections: Iterable[str]) -> str:
    """A whole page; ``sections`` are HTML, ``title`` is text."""
    body = "\n".join(sections)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def section(title: str, *blocks: str) -> str:
    """A heading and what is under it."""
    return "\n".join([f"<section>\n<h2>{escape(title)}</h2>", *blocks, "</section>"])


def card(*blocks: str) -> str:
    """A framed box."""
    return f'<div class="card">{"".join(blocks)}</div>'


def grid(blocks: Iterable[str]) -> str:
    """Boxes beside each other as far as the page is wide."""
    return f'<div class="grid">{"".join(blocks)}</div>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts; a cell that begins with ``<`` is HTML already."""
    header = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(f'<td>{_cell(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table></div>'


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Names and values below each other."""
    rows = "".join(
        f'<tr><td class="key">{escape(key)}</td><td><code>{escape(value)}</code></td></tr>' for key, value in pairs
    )
    return f'<div class="scroll"><table><tbody>{rows}</tbody></table></div>'


def themed_picture(light: bytes, dark: bytes, caption: str) -> str:
    """A PNG in two versions; the page shows the one that suits its theme."""
    return (
        f'<figure class="plot"><figcaption>{escape(caption)}</figcaption><picture>'
        f'<source media="(prefers-color-scheme: dark)" srcset="{data_url(dark, "image/png")}">'
        f'<img alt="{escape(caption)}" src="{data_url(light, "image/png")}"></picture></figure>'
    )


def film(gif: bytes, caption_html: str, alt: str) -> str:
    """An animation with a caption, which is HTML."""
    image = f'<img alt="{escape(alt)}" src="{data_url(gif, "image/gif")}" loading="lazy">'
    return f"<figure>{image}<figcaption>{caption_html}</figcaption></figure>"


def data_url(content: bytes, media_type: str) -> str:
    """Content as part of the page itself."""
    return f"data:{media_type};base64,{b64encode(content).decode()}"


def _cell(text: str) -> str:
    return text if text.startswith("<") else escape(text)
