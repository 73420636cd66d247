"""What all pictures of a diagnosis share: a colour for each model, and plain axes."""

from matplotlib.axes import Axes

MEASURED = "#1d2733"
COLOURS = {
    "nominal": "#b9c2cb",
    "refitted": "#e8963a",
    "black_box": "#7a9e3b",
    "with_effect": "#0b6bb5",
}  # by stage; the black box below what is drawn after it


def tidy(*axes: Axes) -> None:
    """Leave of axes what is needed to read them."""
    for ax in axes:
        ax.grid(color="#dfe4e9", lw=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=8)
        ax.xaxis.label.set_fontsize(9)
        ax.yaxis.label.set_fontsize(9)
