"""What several tests need: shipped worlds, random models, naive twins, commands, pages."""
