"""Observers that send runs to MLflow, Weights & Biases and TensorBoard."""

from evoros.files.plugins import Plugin

PLUGIN = Plugin(
    __name__,
    "tracking of runs in MLflow, Weights & Biases and TensorBoard",
    extras=("mlflow", "tensorboard", "wandb"),
)
