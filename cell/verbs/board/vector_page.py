"""A page of dark rectangles, thin lines and small text, in millimetres, as PDF or SVG.

Written here and not by a plotting library: a cell is set up with the base install, and nothing may
scale, clip or thicken what is drawn. All rectangles are one path, so that no viewer shows a light
seam where two of them touch.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

Rectangle = tuple[float, float, float, float]
"""Left, top, width, height."""
Line = tuple[float, float, float, float]
"""From x, y to x, y."""
Text = tuple[float, float, str]
"""Left end of the baseline, and the words."""

_POINTS_PER_MM = 72.0 / 25.4
_TEXT_MM = 2.5
_LINE_MM = 0.2


@dataclass(frozen=True)
class VectorPage:
    """What stands on one page; x to the right and y downwards from the top left corner."""

    title: str
    width_mm: float
    height_mm: float
    rectangles: tuple[Rectangle, ...]
    lines: tuple[Line, ...] = ()
    texts: tuple[Text, ...] = ()

    def svg(self) -> str:
        """The page as SVG, one user unit a millimetre."""
        path = "".join(f"M{x:.4f} {y:.4f}h{w:.4f}v{h:.4f}h{-w:.4f}z" for x, y, w, h in
                       self.rectangles)  # fmt: skip
        ruled = "".join(f"M{x:.4f} {y:.4f}L{to_x:.4f} {to_y:.4f}" for x, y, to_x, to_y in
                        self.lines)  # fmt: skip
        labels = "".join(f'<text x="{x:.3f}" y="{y:.3f}">{escape(text)}</text>\n' for x, y, text in
                        self.texts)  # fmt: skip
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width_mm:.4f}mm"'
            f' height="{self.height_mm:.4f}mm" viewBox="0 0 {self.width_mm:.4f}'
            f' {self.height_mm:.4f}" font-family="Helvetica, Arial, sans-serif"'
            f' font-size="{_TEXT_MM}">\n<title>{escape(self.title)}</title>\n'
            f'<rect width="100%" height="100%" fill="white"/>\n<path d="{path}"/>\n'
            f'<path d="{ruled}" stroke="black" stroke-width="{_LINE_MM}" fill="none"/>\n'
            f"{labels}</svg>\n"
        )

    def pdf(self) -> str:
        """The page as PDF, ASCII alone; viewers that heed its preference print it unscaled."""
        wide, high = self.width_mm * _POINTS_PER_MM, self.height_mm * _POINTS_PER_MM
        content = self._content(high)
        return _pdf_file(
            "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {wide:.4f} {high:.4f}] /Contents 4 0 R"
            " /Resources << /Font << /F 5 0 R >> >> >>",
            f"<< /Length {len(content)} >>\nstream\n{content}\nendstream",
            "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
            f"<< /Title ({_pdf_text(self.title)}) >>",
        )

    def _content(self, high: float) -> str:
        """Drawing operators; the first one turns points, y up, into millimetres, y down."""
        scale = _POINTS_PER_MM
        drawn = [f"{scale:.10f} 0 0 {-scale:.10f} 0 {high:.4f} cm", "0 g 0 G"]
        drawn += [f"{x:.4f} {y:.4f} {w:.4f} {h:.4f} re" for x, y, w, h in self.rectangles]
        drawn += ["f", f"{_LINE_MM} w"]
        drawn += [f"{x:.4f} {y:.4f} m {to_x:.4f} {to_y:.4f} l S" for x, y, to_x, to_y in self.lines]
        drawn += [
            f"BT /F {_TEXT_MM} Tf 1 0 0 -1 {x:.3f} {y:.3f} Tm ({_pdf_text(text)}) Tj ET"
            for x, y, text in self.texts
        ]
        return "\n".join(drawn)


def _pdf_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")


def _pdf_file(*objects: str) -> str:
    """Objects numbered from 1, the last one the document's information, and where each begins."""
    written = "%PDF-1.4\n"
    begins = []
    for number, body in enumerate(objects, start=1):
        begins.append(len(written))
        written += f"{number} 0 obj\n{body}\nendobj\n"
    table = "".join(f"{begin:010d} 00000 n \n" for begin in begins)
    size = len(objects) + 1
    return (
        f"{written}xref\n0 {size}\n0000000000 65535 f \n{table}"
        f"trailer\n<< /Size {size} /Root 1 0 R /Info {len(objects)} 0 R >>\n"
        f"startxref\n{len(written)}\n%%EOF\n"
    )
