"""Configuration; no other package imports Hydra and OmegaConf."""
