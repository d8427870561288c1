"""Speech as it is spoken: frames within a stated time."""
