"""The experiments, one file each; `registry` lists them."""
