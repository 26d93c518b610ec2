"""The uplinks to the cloud, HTTP and MQTT 5; each gives the relay the answers of HTTP."""
