"""Published facts about mantas and their robots beside the simulator: `python -m evidence.validation`."""
