"""Configuration: the only room that knows Hydra and OmegaConf."""
