"""Files that ship with mazebench, imported as `mazebench_assets`."""
