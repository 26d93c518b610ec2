"""The uplinks to the cloud, HTTP and MQTT 5; each returns HTTP answers to the relay."""
