"""The bundled scenes: ``halfstep.load("figure")`` reads ``figure.toml`` from this folder."""
