"""A headless Chromium that a test drives: opens a page, acts like a user, and notes what the page says and asks for.

Below it, how the demonstration is opened and read.
"""

import json
import shlex
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import websocket  # comes with Jupyter

from homing_lib.publish.demo import PAGE

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

_QUIET = shlex.split(
    "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync --disable-dev-shm-usage --hide-scrollbars --remote-debugging-port=0 --remote-allow-origins=*"
)

_KEYS = {"Enter": 13, "Escape": 27, " ": 32, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}


class Browser:
    """One page in a browser of its own."""

    def __init__(self, profile: Path) -> None:
        assert CHROMIUM is not None
        self.said: list[str] = []  # errors and warnings on the console
        self.asked: list[str] = []  # addresses that were requested
        command = [CHROMIUM, *_QUIET, f"--user-data-dir={profile}", "about:blank"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        ready = profile / "DevToolsActivePort"
        for _ in range(1200):
            if ready.exists() and "\n" in ready.read_text(encoding="utf-8"):
                break
            time.sleep(0.1)
        port = ready.read_text(encoding="utf-8").split()[0]
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=30) as answer:
            target = next(target for target in json.load(answer) if target["type"] == "page")
        self._socket = websocket.create_connection(target["webSocketDebuggerUrl"], timeout=60)
        self._number = 0
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()
        self._process.terminate()
        self._process.wait(30)

    def call(self, method: str, **parameters: Any) -> Any:
        """One command of the DevTools protocol."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        event, serious = message.get("params", {}), ("error", "warning")
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.said.append(json.dumps(event["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if event["type"] in serious:
                self.said.append(json.dumps(event["args"]))
            case "Log.entryAdded" if event["entry"]["level"] in serious:
                self.said.append(event["entry"]["text"])
            case "Network.requestWillBeSent":
                self.asked.append(event["request"]["url"])

    def resize(self, width: int, height: int) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)

    def open(self, address: str) -> None:
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=address)
        self.until("document.readyState === 'complete'")

    def __call__(self, expression: str) -> Any:
        """What an expression gives in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def until(self, condition: str, seconds: float = 60) -> None:
        """Wait until it holds."""
        end = time.monotonic() + seconds
        while not self(f"Boolean({condition})"):
            if time.monotonic() > end:
                raise TimeoutError(condition)
            time.sleep(0.05)

    def click(self, element: str) -> None:
        x, y = self(
            f"""(() => {{
              const element = document.querySelector({json.dumps(element)});
              element.scrollIntoView({{ block: "center" }});
              const box = element.getBoundingClientRect();
              return [box.x + box.width / 2, box.y + box.height / 2];
            }})()"""
        )
        self.drag((x, y))

    def drag(self, *places: tuple[float, float]) -> None:
        """Press at the first place, move to the others, let go at the last."""
        self.mouse("mousePressed", places[0])
        for place in places[1:]:
            self.mouse("mouseMoved", place)
        self.mouse("mouseReleased", places[-1])

    def mouse(self, kind: str, place: tuple[float, float]) -> None:
        x, y = place
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def press(self, *keys: str) -> None:
        for key in keys:
            named = {"key": key, "windowsVirtualKeyCode": _KEYS.get(key, ord(key[0].upper()))}
            letter = {"text": "\r" if key == "Enter" else key} if len(key) == 1 or key == "Enter" else {}
            self.call("Input.dispatchKeyEvent", type="keyDown", **named, **letter)
            self.call("Input.dispatchKeyEvent", type="keyUp", **named)

    def type(self, text: str) -> None:
        self.call("Input.insertText", text=text)


DEMONSTRATION = PAGE.as_uri()


def opened(browser: Browser, state: str) -> None:
    browser.open(f"{DEMONSTRATION}#{state.removeprefix('#')}")
    browser.until("robotView.world && (state.view === 'walk' || robotView.experiment)")


def title(browser: Browser, canvas: str) -> str:
    """What a figure says, once all that waits is painted."""
    browser("new Promise((done) => setTimeout(done, 100))")
    browser.until(f"at('{canvas}').getAttribute('aria-label')")
    return browser(f"at('{canvas}').getAttribute('aria-label')")
