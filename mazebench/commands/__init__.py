"""The commands of `mazebench`, one file each."""
