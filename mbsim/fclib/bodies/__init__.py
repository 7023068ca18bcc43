"""Problems of rigid bodies solved in the bodies' velocities, six unknowns a body."""
