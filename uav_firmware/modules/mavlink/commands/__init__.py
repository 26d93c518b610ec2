"""The command and parameter protocols, and input streamed by ground stations."""
