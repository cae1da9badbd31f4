"""A survey with one image of every kind, good and bad."""

import os
import struct
import unicodedata
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

E_ACUTE = unicodedata.normalize("NFC", "é")
SAME_IN_NFC = unicodedata.normalize("NFD", "é")


def picture(seed: int) -> Image.Image:
    rng = np.random.default_rng(seed)
    pixels = np.full((200, 240, 3), 128, np.uint8)
    for _ in range(100):
        x, y = rng.integers(0, 230), rng.integers(0, 190)
        w, h = rng.integers(6, 40, 2)
        pixels[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    return Image.fromarray(pixels)


def png_header(width: int, height: int, depth: int = 8, data: bytes = b"") -> bytes:
    """A PNG that says how large it is; RGB."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        )

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def sixteen_bit(image: Image.Image) -> bytes:
    samples = np.asarray(image).astype(">u2") * 257
    lines = b"".join(b"\0" + line.tobytes() for line in samples)
    return png_header(image.width, image.height, 16, zlib.compress(lines))


SKIPPED = {
    "truncated.jpg": "truncated",
    "zero.jpg": "empty (0 bytes)",
    "text.jpg": "not a supported image",
    "huge.png": "more than max_pixels",
    "nan.jpg": "expected a finite number",
    "far.jpg": "far outside the area of use",
    "missing.jpg": "pose without image",
    "unposed.jpg": "image without pose",
    "loop.jpg": "symbolic links",
    f"nf/{E_ACUTE}.jpg": "the same once written in Unicode NFC",
    "caf\N{REPLACEMENT CHARACTER}.jpg": "not UTF-8",
}
INDEXED = {
    *("deep.png", "alpha.png", "cmyk.jpg", "turned.jpg", "one.png", "flat.png"),
    *(f"nf/{E_ACUTE}.jpg", "nf/日本 \"'<script>.jpg", "a/same.jpg", "b/same.jpg"),
}


def fill(folder: Path) -> None:
    """One image of every kind, good and bad, and their pose table."""
    for name in ("nf", "a", "b"):
        (folder / name).mkdir(parents=True)
    for name in ("nan.jpg", "far.jpg", "unposed.jpg", "truncated.jpg"):
        picture(1).save(folder / name)
    whole = (folder / "truncated.jpg").read_bytes()
    (folder / "truncated.jpg").write_bytes(whole[: len(whole) // 2])
    (folder / "zero.jpg").touch()
    (folder / "text.jpg").write_text("This is no picture.")
    (folder / "huge.png").write_bytes(png_header(30_000, 30_000))
    (folder / "loop.jpg").symlink_to("loop.jpg")
    (folder / "loop").symlink_to("loop")
    (folder / "up").symlink_to("..")
    (folder / "self").symlink_to(".")
    picture(1).save(os.fsencode(folder) + b"/caf\xe9.jpg", "JPEG")
    for number, name in enumerate((E_ACUTE, SAME_IN_NFC, "日本 \"'<script>")):
        picture(10 + number).save(folder / "nf" / f"{name}.jpg")
    (folder / "deep.png").write_bytes(sixteen_bit(picture(20)))
    picture(21).convert("RGBA").save(folder / "alpha.png")
    picture(22).convert("CMYK").save(folder / "cmyk.jpg")
    exif = Image.Exif()
    exif[0x0112] = 6
    picture(23).save(folder / "turned.jpg", exif=exif)
    Image.new("RGB", (1, 1)).save(folder / "one.png")
    Image.new("RGB", (200, 200), "grey").save(folder / "flat.png")
    picture(24).save(folder / "a" / "same.jpg")
    picture(25).save(folder / "b" / "same.jpg")
    rows = ["file,x,y"]
    for number, name in enumerate(sorted((INDEXED | SKIPPED.keys()) - {"unposed.jpg"})):
        x = {"nan.jpg": "nan", "far.jpg": "9e6"}.get(name, str(652_000 + 5 * number))
        rows.append('"' + name.replace('"', '""') + f'",{x},6862000')
    (folder / "poses.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
