"""Pictures and films of a page, made by a browser without a window."""

from __future__ import annotations

import base64
import io
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mbsim.errors import ModelError, ResultsError
from mbsim.results.products import check_product, write_product
from mbsim.view.browser import Page, needed_browser, opened_page

#: Frames a second of a film, of an animated GIF, and most frames of either.
FILM_RATE, GIF_RATE, MOST_FRAMES = 30, 20, 3000
#: Kinds of pictures, and the options that ask for them.
PNG, GIF, MP4 = ("PNG picture", "--png"), ("GIF picture", "--gif"), ("film", "--mp4")
#: Seconds that a film takes where no speed is asked for: at least, at most.
_SHORT, _LONG = 2.5, 20.0
#: What is told how many pictures of a film there are, and how many there will be.
Progress = Callable[[int, int], None]


def check_tools(png: Path | None, gif: Path | None, mp4: Path | None) -> None:
    """Raise `ModelError` where something is missing that these pictures need, or is in the way."""
    for file, about in ((png, PNG), (gif, GIF), (mp4, MP4)):
        if file is not None:
            ending = about[1].replace("--", ".")
            if file.suffix.lower() != ending:
                raise ModelError(f"{about[1]} {file}: the file must end in {ending}")
            check_product(file, *about)
    if png or gif or mp4:
        needed_browser()
    if mp4 is not None and shutil.which("ffmpeg") is None:
        raise ModelError("--mp4 needs ffmpeg, which is not there (Debian: apt-get install ffmpeg)")
    if gif is not None:
        try:
            import PIL  # noqa: F401
        except ImportError:
            raise ModelError(
                "--gif needs Pillow: pip install 'mbsim-contact[plot]', or take --mp4"
            ) from None


class Camera:
    """A page of a view that is asked for pictures."""

    def __init__(self, page: Page, text: str, folder: Path) -> None:
        self.page = page
        file = folder / "view.html"
        file.write_bytes(text.encode("utf-8"))
        page.open(file.as_uri() + "#picture")  # smooth edges, whoever draws
        first, last = page.run("mbsimReady.then(view => view.span)")
        self.span: tuple[float, float] = (float(first), float(last))
        #: Units of time a second.
        self.second = float(page.run("mbsimView.realTime || 1"))

    def picture(self, time: float) -> bytes:
        """Return the scene at a time as PNG; `ModelError` where the run has no such time."""
        first, last = self.span
        if not first <= time <= last:
            raise ModelError(f"--time {time:g}: the run shows times from {first:g} to {last:g}")
        address: str = self.page.run(f"mbsimView.still({time!r})")
        return base64.b64decode(address.partition(",")[2])

    def times(self, rate: float, speed: float | None) -> list[float]:
        """Return the times of a film's frames, `rate` a second, at so many times real time."""
        first, last = self.span
        seconds = (last - first) / self.second
        shown = seconds / speed if speed else min(max(seconds, _SHORT), _LONG)
        count = max(2, round(rate * shown))
        if count > MOST_FRAMES:
            raise ModelError(f"{count} frames are more than {MOST_FRAMES}: take a higher --speed")
        return [first + (last - first) * k / (count - 1) for k in range(count)]

    def frames(self, times: Sequence[float], progress: Progress | None) -> Iterator[bytes]:
        """Yield the scene at times as PNG."""
        for done, time in enumerate(times, 1):
            yield self.picture(time)
            if progress is not None:
                progress(done, len(times))


def make(
    text: str,
    size: tuple[int, int],
    png: Path | None = None,
    gif: Path | None = None,
    mp4: Path | None = None,
    time: float | None = None,
    speed: float | None = None,
    progress: Progress | None = None,
) -> None:
    """Write pictures of a page.

    Parameters
    ----------
    text : str
        The page.
    size : (int, int)
        Width and height in pixels.
    png, gif, mp4 : path, optional
        Files to write.
    time : float, optional
        Of the PNG [T]; default: half of the run.
    speed : float, optional
        Of films, in times real time; default: such that one takes 2.5 to 20 seconds.
    progress : callable, optional
        Called as ``progress(done, count)`` after each picture of a film.

    Raises
    ------
    ModelError
        If a tool is missing, see `check_tools`.
    ResultsError
        If a file cannot be written.
    """
    check_tools(png, gif, mp4)
    with opened_page(*size) as page, tempfile.TemporaryDirectory(prefix="mbsim-view-") as folder:
        camera = Camera(page, text, Path(folder))
        if png is not None:
            at = 0.5 * sum(camera.span) if time is None else time
            write_product(png, camera.picture(at), *PNG)
        if gif is not None:
            times = camera.times(GIF_RATE, speed)
            middle = camera.picture(times[len(times) // 2])
            write_product(gif, _gif(camera.frames(times, progress), middle), *GIF)
        if mp4 is not None:
            film = Path(folder) / "film.mp4"
            _film(camera.frames(camera.times(FILM_RATE, speed), progress), film)
            write_product(mp4, film.read_bytes(), *MP4)


def _gif(frames: Iterator[bytes], middle: bytes) -> bytes:
    """Return frames as an animated GIF that repeats, all with the colours of the middle one.

    One frame is held at a time.
    """
    from PIL import Image

    def opened(frame: bytes) -> Image.Image:
        return Image.open(io.BytesIO(frame)).convert("RGB")

    colours = opened(middle).quantize(255)
    reduced = (opened(frame).quantize(palette=colours) for frame in frames)
    made = io.BytesIO()
    next(reduced).save(
        made,
        "GIF",
        save_all=True,
        append_images=reduced,
        duration=1000 // GIF_RATE,
        loop=0,
        optimize=False,
    )
    return made.getvalue()


def _film(frames: Iterator[bytes], file: Path) -> None:
    """Write frames as H.264 in MP4, by ffmpeg."""
    command = [
        *("ffmpeg", "-y", "-loglevel", "error", "-f", "image2pipe", "-framerate", str(FILM_RATE)),
        *("-c:v", "png", "-i", "-", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"),
        # H.264 takes even sizes
        *("-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", "-movflags", "+faststart"),
        *("-f", "mp4", str(file)),
    ]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdin is not None
    try:
        for frame in frames:
            process.stdin.write(frame)
    except BrokenPipeError:
        pass  # it says why below
    finally:
        _, said = process.communicate()
    if process.returncode:
        lines = said.decode("utf-8", "replace").strip().splitlines() or ["ffmpeg failed"]
        raise ResultsError(f"{file}: {lines[-1]}")
