"""
browser.py PAGE: open a file or URL in Chromium, without a window, and say as JSON what it shows.

A program of its own: Qt wants the main thread, and a browser that falls must not take the tests
with it.

"""

from __future__ import annotations

import json
from pathlib import Path
import sys
from typing import Any

from PySide6.QtCore import QTimer, QUrl
from PySide6.QtWebEngineCore import (
    QWebEnginePage,
    QWebEngineProfile,
    QWebEngineSettings,
    QWebEngineUrlRequestInfo,
    QWebEngineUrlRequestInterceptor,
)
from PySide6.QtWebEngineWidgets import QWebEngineView
from PySide6.QtWidgets import QApplication
import shiboken6

WIDTH, HEIGHT = 1200, 900
PATIENCE_MS = 600_000
ANSWER = 'what is shown: '
# A blank picture has one colour. What is wider than the window would have to be scrolled to.
LOOK = """
Promise.all(Array.from(document.images, async image => {
  const decoded = await image.decode().then(() => true, () => false);
  const box = image.getBoundingClientRect();
  const embedded = image.src.startsWith('data:');
  let colours = 0;
  if (decoded && embedded) {
    const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
    colours = new Set(new Uint32Array(pixels.buffer)).size;
  }
  return {embedded, colours, size: [image.naturalWidth, image.naturalHeight],
          shown: decoded && box.width > 0 && box.height > 0};
})).then(images => console.info(ANSWER + JSON.stringify({
  images, title: document.title,
  canvases: Array.from(document.querySelectorAll('canvas'), each => new Set(new Uint32Array(
    each.getContext('2d').getImageData(0, 0, each.width, each.height).data.buffer)).size),
  rows: document.querySelectorAll('.rows .body .row').length,
  summary: document.querySelector('#summary')?.textContent,
  overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth})));
""".replace('ANSWER', repr(ANSWER))


class Refusal(QWebEngineUrlRequestInterceptor):
    """Lets a page load itself, what it holds and what its own server has, and nothing else."""

    def __init__(self, page: QUrl) -> None:
        super().__init__()
        self._page = page
        self.refused: list[str] = []

    def interceptRequest(self, info: QWebEngineUrlRequestInfo) -> None:
        url = info.requestUrl()
        served = self._page.authority() and url.authority() == self._page.authority()
        if url != self._page and url.scheme() != 'data' and not served:
            self.refused.append(url.toString())
            info.block(True)


class Listening(QWebEnginePage):
    """Keeps what a page writes to its console, and ends the program with the answer."""

    def __init__(self, profile: QWebEngineProfile) -> None:
        super().__init__(profile)
        self.answer: dict[str, Any] | None = None
        self.console: list[str] = []

    def javaScriptConsoleMessage(
        self, level: object, message: str, line: int, source: str
    ) -> None:
        if message.startswith(ANSWER):
            self.answer = json.loads(message.removeprefix(ANSWER))
            QTimer.singleShot(0, QApplication.quit)
        else:
            self.console.append(message)


def look(place: str) -> dict[str, Any] | None:
    """Return what a page shows, asked for and wrote; None where it does not load in time."""
    application = QApplication([])
    url = QUrl(place) if '://' in place else QUrl.fromLocalFile(str(Path(place).resolve()))
    refusal = Refusal(url)
    profile = QWebEngineProfile()  # keeps nothing on disk
    profile.setUrlRequestInterceptor(refusal)
    page = Listening(profile)
    # else Qt would refuse by itself what lies in the network, and nobody would hear of it
    page.settings().setAttribute(
        QWebEngineSettings.WebAttribute.LocalContentCanAccessRemoteUrls, True
    )
    view = QWebEngineView()
    view.setPage(page)
    view.resize(WIDTH, HEIGHT)
    view.show()
    page.loadFinished.connect(
        lambda loaded: page.runJavaScript(LOOK) if loaded else application.quit()
    )
    page.load(url)
    QTimer.singleShot(PATIENCE_MS, application.quit)
    application.exec()
    for part in (view, page, profile):  # a page before its profile, as Qt asks
        shiboken6.delete(part)
    heard = {'refused': refusal.refused, 'console': page.console}
    return None if page.answer is None else {**page.answer, **heard}


if __name__ == '__main__':
    print(json.dumps(look(sys.argv[1])))  # noqa: T201
