"""One file per way that robots and programs are handed a rigid transform."""
