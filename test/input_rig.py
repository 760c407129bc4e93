# SPDX-License-Identifier: Apache-2.0
"""A graph and a clock for the node's inputs, without ROS processes: a list stands for a topic."""


class Subscription:
    """What Inputs polls; a list stands for the middleware."""

    def __init__(self, kind, topic):
        self.msg_type, self.topic_name = kind, topic
        self.handle = self
        self.waiting = []
        self.publishers = 1

    def take_message(self, kind, raw):
        assert kind is self.msg_type
        assert raw
        return self.waiting.pop(0) if self.waiting else None

    def get_publisher_count(self):
        return self.publishers


class Graph:
    """Makes the subscriptions; ``topics`` has the last one of each topic, by its last part."""

    def __init__(self):
        self.topics, self.offered, self.own, self.destroyed = {}, {}, {}, []

    @staticmethod
    def resolve(topic):
        return topic

    def subscribe(self, kind, topic, profile, overridable=True):
        made = self.topics[topic.rpartition('/')[2]] = Subscription(kind, topic)
        made.profile = profile
        return made

    def destroy(self, subscription):
        self.destroyed.append(subscription)

    def offers(self, topic):
        return self.offered.get(topic, ())

    def count(self, topic):
        return len(self.offered.get(topic, ()))

    def asked(self, topic, kind):
        return self.own.get(topic)


class Clock:
    """What the test says that it is."""

    def __init__(self):
        self.now, self.elapsed, self.simulated = 1000.0, 0.0, False

    @property
    def polled(self):
        return self.now

    def relate(self):
        pass

    @staticmethod
    def time_of(nanoseconds):
        return nanoseconds * 1e-9
