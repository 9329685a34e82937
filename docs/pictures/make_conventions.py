"""Draw docs/pictures/conventions.png: python docs/pictures/make_conventions.py.

Everything but the camera sketch is computed by the library itself, so the picture cannot
disagree with the code. Needs matplotlib (the extra "train" has it).
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from deeplight import frames
from deeplight.camera import BACKGROUND_FRACTION, TRAINED_CAMERA
from deeplight.mappings import cube, latlong, mirror_ball
from deeplight.sphere import PAPER_RIG, SphereView

AXES = {
    "+X right": (1, 0, 0),
    "−X left": (-1, 0, 0),
    "+Y up": (0, 1, 0),
    "−Y down": (0, -1, 0),
    "+Z behind the camera": (0, 0, 1),
    "−Z straight ahead": (0, 0, -1),
}
INK = {"fontsize": 10, "ha": "center", "va": "center", "color": "black"}
BOX = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.75}


def colours(directions: np.ndarray) -> np.ndarray:
    """A colour for every direction: red grows with X, green with Y, blue with Z."""
    least, middle, _ = np.moveaxis(np.sort(np.abs(directions), axis=-1), -1, 0)[..., None]
    lined = (least < 0.012) & (middle > 0.1)  # the three great circles
    return np.where(lined, 1.0, 0.55 + 0.4 * directions)


def draw_ball(axes: Axes) -> None:
    u, v = mirror_ball.grid(512)
    picture = colours(mirror_ball.directions_from_uv(u, v))
    picture[np.hypot(u, v) > 1] = 1
    axes.imshow(picture, extent=(-1, 1, -1, 1))
    for name, axis in AXES.items():
        u, v = (float(a[0]) for a in mirror_ball.uv_from_directions(np.array([axis], float)))
        place = (u, v) if axis != (0, 0, -1) else (0, -1.06)
        text = name if axis != (0, 0, -1) else "the whole rim: −Z straight ahead"
        axes.text(*place, text.replace(" behind", "\nbehind"), bbox=BOX, **INK)
    around = np.linspace(0, 2 * np.pi, 200)
    axes.plot(np.cos(around) / np.sqrt(2), np.sin(around) / np.sqrt(2), "k:", lw=1)
    axes.annotate("u", (1.12, -0.9), (0.8, -0.9), arrowprops={"arrowstyle": "->"}, va="center")
    axes.annotate("v", (-0.97, 1.1), (-0.97, 0.75), arrowprops={"arrowstyle": "->"}, ha="center")
    axes.set(xlim=(-1.15, 1.15), ylim=(-1.15, 1.15), title="Mirror ball (row 0 at the top)")
    axes.axis("off")


def draw_latlong(axes: Axes) -> None:
    axes.imshow(colours(latlong.directions(256, 512).astype(float)), extent=(0, 512, 256, 0))
    for name, axis in AXES.items():
        if axis == (0, 0, 1):
            continue  # at both edges
        row, column = (float(a[0]) for a in latlong.position(np.array([axis], float), 256, 512))
        column = 256.0 if axis[1] else column
        axes.text(column, min(max(row, 14), 242), name, bbox=BOX, **INK)
    for column in (18, 494):
        axes.text(column, 128, "+Z\nbehind", bbox=BOX, **{**INK, "fontsize": 8})
    axes.set(title="Latlong, 1 : 2 (column 0 on the left, row 0 = up)", xticks=[], yticks=[])


def draw_cube(axes: Axes) -> None:
    """The faces laid out as a cross around −Z."""
    size, directions = 128, cube.directions(128)
    places = {"+y": (0, 1), "-x": (1, 0), "-z": (1, 1), "+x": (1, 2), "+z": (1, 3), "-y": (2, 1)}
    for name, (row, column) in places.items():
        x, y = column * size, row * size
        picture = colours(directions[cube.FACES.index(name)])
        axes.imshow(picture, extent=(x, x + size, y + size, y))
        axes.plot([x, x + size, x + size, x, x], [y, y, y + size, y + size, y], "k", lw=0.8)
        label = f"{cube.FACES.index(name)}: {name.upper().replace('-', '−')}"
        axes.text(x + size / 2, y + size / 2, label, bbox=BOX, **INK)
    axes.set(
        xlim=(-2, 4 * size + 2), ylim=(3 * size + 2, -2), title="Cube faces, as stored (0 to 5)"
    )
    axes.axis("off")


def draw_camera(axes: Axes) -> None:
    """An oblique sketch: X to the right, Y up, Z towards the reader and down left."""

    def at(x: float, y: float, z: float) -> np.ndarray:
        return np.array([x - 0.45 * z, y - 0.32 * z])

    half_width, half_height = TRAINED_CAMERA.tangents
    depth = 1.6
    corners = [
        at(sx * half_width * depth, sy * half_height * depth, -depth)
        for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    axes.fill(*np.transpose(corners), fc="#dce8f4", ec="#5580aa")
    for corner in corners[:4]:
        axes.plot(*np.transpose([at(0, 0, 0), corner]), color="#5580aa", lw=0.8)
    for name, (x, y, z) in AXES.items():
        if name[0] == "+":
            end = at(1.1 * x, 1.1 * y, 1.5 * z)
            axes.annotate("", end, at(0, 0, 0), arrowprops={"arrowstyle": "-|>", "lw": 2})
            axes.text(*(end * 1.12 + [0, 0.05]), name, **INK)
    axes.annotate(
        "", at(0, 0, -depth), at(0, 0, 0), arrowprops={"arrowstyle": "-|>", "lw": 2, "ls": "--"}
    )
    axes.text(*at(0, 0.22, -depth), "−Z\nthe view", **INK)
    axes.text(*(at(0, 0, 0) + [0.3, -0.13]), "camera", **INK)
    axes.set(xlim=(-1.2, 1.9), ylim=(-0.85, 1.8), aspect="equal")
    axes.set_title("Camera frame, right-handed")
    axes.axis("off")


def silhouette(view: SphereView) -> np.ndarray:
    """Where in the frame the sphere's outline lies: (row, column) pairs."""
    around = np.linspace(0, 2 * np.pi, 100)
    sin, cos = np.sin(view.angular_radius_rad), np.cos(view.angular_radius_rad)
    cone = np.stack([sin * np.cos(around), sin * np.sin(around), np.full(100, -cos)], axis=-1)
    return np.stack(TRAINED_CAMERA.pixel_of_directions(cone @ view.ball_from_camera), axis=-1)


def draw_frame(axes: Axes) -> None:
    height, width = TRAINED_CAMERA.height, TRAINED_CAMERA.width
    axes.add_patch(plt.Rectangle((0, 0), width, height, fc="#f2efe8", ec="black"))
    cut = BACKGROUND_FRACTION * height
    axes.plot([0, width], [cut, cut], "k--", lw=1)
    axes.text(
        width / 2, cut / 2 - 260, "background: the network's input\n1080 × 1536 → 135 × 192", **INK
    )
    axes.plot(width / 2, height / 2, "k+", ms=12)
    axes.text(width / 2, height / 2 + 90, "optical axis (−Z)", **INK)
    axes.text(width / 2, cut + 45, "lower 20 %: cut, at inference too", **{**INK, "fontsize": 9})
    grey = {"mirror": "#c8d6e2", "matte_silver": "#d5d5d5", "diffuse": "#a8a8a8"}
    for name, view in PAPER_RIG.views.items():
        row, column = silhouette(view).T
        axes.fill(column, row, fc=grey[name], ec="black")
        towards = view.ball_from_camera.T @ frames.VIEW
        pitch, yaw = np.degrees([np.arcsin(towards[1]), np.arctan2(towards[0], -towards[2])])
        side = f"{abs(yaw):.0f}° {'left' if yaw < 0 else 'right'}" if abs(yaw) > 1 else "ahead"
        label = f"{name.replace('_', ' ')}\n{-pitch:.0f}° down\n{side}"
        axes.text(column.mean(), height + 85, label, **{**INK, "fontsize": 8})
    axes.set(xlim=(-20, width + 20), ylim=(height + 160, -20), aspect="equal")
    axes.set_title("Frame and rig, 66° × 40°")
    axes.axis("off")


def main() -> None:
    figure = plt.figure(figsize=(15, 9.6), dpi=80, layout="constrained")
    grid = figure.add_gridspec(2, 3, width_ratios=[1, 1.25, 0.8])
    draw_camera(figure.add_subplot(grid[0, 0]))
    draw_ball(figure.add_subplot(grid[1, 0]))
    draw_latlong(figure.add_subplot(grid[0, 1]))
    draw_cube(figure.add_subplot(grid[1, 1]))
    draw_frame(figure.add_subplot(grid[:, 2]))
    figure.savefig(Path(__file__).with_name("conventions.png"))


if __name__ == "__main__":
    main()
