"""The network: modules and tensors only. Entry: `network.Network`; `batch` is the door."""
