"""The claims of the 2018 paper on Evo-ROS, and figures that only this paper has."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(
    __name__,
    "claims and figures of the 2018 paper on Evo-ROS",
    figures={
        "failure": f"{__name__}.failure",
        "course": f"{__name__}.course",
        "claims": f"{__name__}.claims",
        "paper": f"{__name__}.numbered_figures",
    },
    exports=frozenset({"paper"}),
)
