"""How well controllers follow paths: `python -m evidence.control_report` writes docs/control_report.md."""
