"""The report of one run: motions, command, base vibration, modes, forces, torques; that of a campaign as a page."""

from .campaign_page import CampaignReport, campaign_report, html_report
from .run_report import Reporting, RunReport

__all__ = ["CampaignReport", "Reporting", "RunReport", "campaign_report", "html_report"]
