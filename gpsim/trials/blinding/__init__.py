"""The blind protocol: conceal worlds, diagnose their recordings without the answers, reveal the answers."""
