"""YAML files to checked configs, settings from the command line, embedded resources."""
